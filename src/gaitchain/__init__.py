"""Online humanoid walking from a Markov chain of key poses, checked by physics."""
