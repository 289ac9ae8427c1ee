"""Each publication has a folder: `paper.toml` says what it prints and who measures it, scenario files hold the flights,
and modules compute what no scenario holds."""
