"""What people look at: reports, overlays, and advice where nothing was found."""
