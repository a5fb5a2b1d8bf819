"""Description of the formats of recordings in the help of commands."""

FORMATS = """
recordings:
  CSV          one movement: a header with names, then a row per sample. The column t
               or time is the time [s]; units in brackets are read. Semicolons, decimal
               commas, the index of pandas and exports of Vicon, OptiTrack and Qualisys
               are recognised:
                 t,hip [rad],knee [rad]
                 0.00,0.31,0.05
                 0.01,0.32,0.07
  folder       all movements in it, or those that its index.csv lists, with the columns
               for --context:
                 index.csv         demos/a.csv  demos/b.csv
                   id,height_m
                   a,1.25
                   b,1.45
  others       .bvh .c3d .trc .mot .sto .parquet (one movement each), .npz .mat .hdf5
               .mcap (several), folders of rosbag2 and LeRobot
  -            standard input, in any of these formats"""
