"""What any family of targets is found and measured by; no family is known here."""
