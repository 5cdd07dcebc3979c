"""The command `cosim`: the doors through which a person comes in; all work is done on the floors below."""
