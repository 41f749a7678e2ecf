"""From fits to evidence: log-likelihood gains, what freedom costs, intervals, and what an explanation leaves."""
