"""How things show themselves to those who work in Python: cards, texts and plots."""
