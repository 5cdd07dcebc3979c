"""Runs beside one another: their curves, what differs in numbers and when, and their hearts side by side."""
