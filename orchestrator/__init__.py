"""The master: scenario, participants, coupled time loop, results. It knows FMI, fields and time, and no heart."""
