"""Finding and measuring targets of any family; no family is known here."""
