"""Laws of the documentation: links lead somewhere, commands and tutorials run, the site is whole."""
