"""One folder a publication: `paper.toml` says what it prints and who measures it, scenario files are what is flown, and
modules compute what no scenario holds."""
