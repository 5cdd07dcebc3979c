"""Packaging: any unit becomes an FMI 2.0 or 3.0 co-simulation FMU."""
