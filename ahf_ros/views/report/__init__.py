"""Reports: results as one page that people look at."""
