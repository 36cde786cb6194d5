"""The serial link: schema and codec, clock estimate, client and transport."""
