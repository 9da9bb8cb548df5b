"""Time stepping of jointed islands: contacts and joints solved together in sub-steps of one length."""
