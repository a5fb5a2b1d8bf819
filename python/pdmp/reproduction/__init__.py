"""The figures of Matsubara, Hyon and Morimoto (2011), made with this library on a simulated robot."""
