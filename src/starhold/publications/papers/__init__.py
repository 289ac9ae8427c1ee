"""The publications, each in a folder: `paper.toml` lists what it prints with the measure of each item, scenario files define
the flights, and modules compute everything else."""
