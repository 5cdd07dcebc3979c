"""What a run leaves behind: time series, fields, coupling log, summary. `report` makes figures and a page of it."""
