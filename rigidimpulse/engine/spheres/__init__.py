"""The event kernel: balls in free flight, from impact to impact, over all steps in which nothing else happens (see `flight`)."""
