"""What people look at: figures, the report page, movies and comparisons, made from what runs left in their folders."""
