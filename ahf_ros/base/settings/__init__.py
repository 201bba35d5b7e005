"""Settings with descriptions, defaults and accepted values."""
