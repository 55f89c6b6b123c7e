"""Models made of relays on a grid of thresholds: Preisach and Krasnosel'skii-Pokrovskii."""
