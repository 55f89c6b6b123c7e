def sentences(search, z, balance, loads):
    return []
