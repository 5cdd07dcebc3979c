"""What a run leaves behind: time series, fields, coupling log, summary and figures."""
