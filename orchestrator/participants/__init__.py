"""What the master couples: the participant it sees, units called directly, and FMUs."""
