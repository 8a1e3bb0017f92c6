"""The robot as numbers: the reduced biped, its legs joint by joint, its storage."""
