"""Packaging: any unit becomes an FMI 3.0 co-simulation FMU, a field one array variable."""
