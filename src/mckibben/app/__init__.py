"""The workbench: a local web page over a folder of plain files.

It has no logic of its own: whatever it does is a call that the library and the command line offer
too, and it shows that call.
"""
