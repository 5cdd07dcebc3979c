"""What theory says of the stability of coupled units and of their explicit steps. One file a theory."""
