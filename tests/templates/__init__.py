"""Laws of the templates: they work as they stand, and obey the contract of what they are for."""
