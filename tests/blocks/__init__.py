"""Laws of single kinds of blocks, beside those of all blocks in tests/contracts.

Inverses are exact; a saved model is the same to the last bit; what cannot be a model is refused as one.
"""
