"""Files, messages, clouds and JSON."""
