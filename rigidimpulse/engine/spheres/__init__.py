"""The event kernel: balls in free flight, from impact to impact, over as many steps as nothing else happens in (see `flight`)."""
