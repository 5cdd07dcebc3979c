"""The files of a results folder by their names, on which other people's scripts rely."""

TIME_SERIES = "timeseries.csv"
COUPLING = "coupling.csv"
ITERATIONS = "iterations.csv"
PROFILE = "profile.json"
FIELDS = "fields.h5"
XDMF = "fields.xdmf"
SUMMARY = "summary.json"
#: What people look at, made from all others.
PAGE = "report.html"
#: Only where an FMU logs something.
FMU_LOG = "fmu.log"

#: What a budget of the run's numerical errors appends.
BUDGET_CSV = "errors.csv"
BUDGET_JSON = "errors.json"
BUDGET_PNG = "errors.png"
BUDGET_SVG = "errors.svg"
BUDGET = (BUDGET_CSV, BUDGET_JSON, BUDGET_PNG, BUDGET_SVG)

#: Only while a run goes on, or to go on from.
PARTS = "fields.parts"
CHECKPOINT = "checkpoint.h5"

#: Those that grow by additions; the others are put in place whole.
GROWING = (TIME_SERIES, COUPLING, ITERATIONS, PROFILE)
WHOLE = (FIELDS, XDMF, SUMMARY, CHECKPOINT)
