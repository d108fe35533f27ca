"""The checks, by what they are about: each module has `checks(catalog)`."""
