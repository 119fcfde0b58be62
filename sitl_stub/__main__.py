"""`python -m sitl_stub` is `sitl-stub`."""

from sitl_stub.cli import main

if __name__ == "__main__":
    main()
