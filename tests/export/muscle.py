"""A muscle that MJCF carries."""

from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.fields import Channel

MUSCLE = Balance(
    springs=((-12.0, 20.0),),
    elasticity=((6.0, 30.0),),
    areas=((100.0, -60.0),),
    friction=((6.0, 0.0, 4.0, 2.0),),
    relaxation=((),),
    loads=((1.0,),),
    damping=(0.05,),
    walls=(0.0,),
    limits=(0.2, 0.5, 1.0, 4.0),
    friction_growth=0.0,
    highest_pressure=6.0,
    lags=(),
    hull=((-5.0, 40.0),),
    scale=40.0,
    degree=1,
    driven=(Channel("displacement", "mm"),),
    scheduled=(Channel("force", "N"),),
    given=(Channel("pressure", "bar"),),
    obstacles=((1.0, 22.0, 5.0, -1.0, 2.0, 3.0),),
    pressure_range=(0.0, 6.0),
)
