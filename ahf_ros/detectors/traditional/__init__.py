"""Traditional identification of ring targets, as the paper compares it."""
