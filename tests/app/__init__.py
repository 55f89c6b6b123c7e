"""Laws of the workbench: every page does what the operation of its name does, in any window.

Long work is a job in a process of its own; what is finished stays in the folder; only the one who
started the server is answered.
"""
