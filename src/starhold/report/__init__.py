"""Results as they are read: the page, figures, tables as CSV and netCDF. Each body has a report in `bodies`."""
