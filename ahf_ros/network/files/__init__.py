"""Files of networks: what is observed and known, and what is computed."""
