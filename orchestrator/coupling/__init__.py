"""The coupling: connections, exchange of values, schemes, and the time loop."""
