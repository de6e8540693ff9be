"""Many runs of a varied scenario."""
