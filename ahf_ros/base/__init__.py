"""The ground: records, settings, texts, ways in and out. It imports no other room."""
