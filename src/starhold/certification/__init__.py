"""Claims about a closed loop with their proofs: each module makes claims of one kind, `certify` collects all of them, and
`certificate` defines the file of proofs."""
