"""Anatomies: each a recipe from a mesh size to a mesh with named boundaries."""
