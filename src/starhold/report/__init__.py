"""Results in readable form: the page, figures, and tables as CSV and netCDF. Each body has a report in `bodies`."""
