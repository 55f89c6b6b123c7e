"""The five pages of the workbench, one file each."""
