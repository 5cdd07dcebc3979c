"""What the pictures and pages of all studies are made with."""
