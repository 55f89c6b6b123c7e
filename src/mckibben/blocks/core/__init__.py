"""What a block is, and what blocks are made with: channels, kernels, parameters, inverses, files."""
