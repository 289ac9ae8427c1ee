"""Claims about a closed loop with their proofs: each module makes claims of one kind, `certify` asks for all of them, and
`certificate` says what a file of proofs holds."""
