"""Set-ups: what a rig's muscles are built into, one file each."""
