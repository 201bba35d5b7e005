"""A network as one page, as tables and as figures."""
