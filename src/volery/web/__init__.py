"""The web page. Not there yet."""
