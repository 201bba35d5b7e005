"""Sheets of targets to print, true to scale."""
