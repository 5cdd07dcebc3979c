"""Movies of what a run left: the moving tissue with a field on it, and a curve whose cursor moves along."""
