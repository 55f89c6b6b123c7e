"""Models with the parameters that papers print, one file a paper; the registry names them."""
