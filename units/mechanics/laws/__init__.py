"""Passive laws: strain energies, one file each."""
