"""What an FMU says of a Python that lacks a package: code for the stubs that load the packaged units."""

#: Raised for the ModuleNotFoundError `error`; the stub has imported sys.
MISSING_PACKAGE = """raise ImportError(
            "this FMU needs the Python package '" + str(error.name).partition(".")[0] + "', which the Python "
            + sys.version.split()[0] + " at " + sys.prefix + " does not have; install numpy, scipy, scikit-fem and "
            "meshio there; hosts without a Python of their own take that of the environment variable COSIM_PYTHON"
        ) from None"""
