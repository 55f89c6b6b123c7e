"""Force of a muscle by length and pressure: static laws, friction, and what pressure gives a force."""
