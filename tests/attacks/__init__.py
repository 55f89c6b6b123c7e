"""Laws of hostile files: nothing in a report or a received folder runs, uploads or leads away."""
