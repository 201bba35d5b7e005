"""Identifying targets: settings, the search for filters, and images in order."""
