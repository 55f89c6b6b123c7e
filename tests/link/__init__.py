"""Laws of the serial link: nothing wrong is applied, the watchdog acts, and the link goes on."""
