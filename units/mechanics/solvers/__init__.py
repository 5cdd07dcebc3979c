"""Solvers of the equilibrium, and the factorisations they stand on."""
