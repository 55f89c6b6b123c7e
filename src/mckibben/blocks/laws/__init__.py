"""The contract of a block as laws, to which every block is put."""
