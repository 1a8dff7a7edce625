"""The public names: for type checkers, and for `contact/__init__.py`, which imports them lazily."""

from contact.body.description import Body as Body
from contact.body.description import Fixed as Fixed
from contact.body.description import Load as Load
from contact.body.description import Material as Material
from contact.body.rigid import Electrode as Electrode
from contact.body.rigid import Motion as Motion
from contact.body.rigid import Rigid as Rigid
from contact.case.build import build_problem as build_problem
from contact.case.file import Case as Case
from contact.case.file import load_case as load_case
from contact.case.file import parse_case as parse_case
from contact.case.material import make_material as make_material
from contact.errors import InputError as InputError
from contact.interface.friction import Friction as Friction
from contact.interface.law import Conductor as Conductor
from contact.interface.layer import Layer as Layer
from contact.interface.obstacle import Cone as Cone
from contact.interface.obstacle import Cylinder as Cylinder
from contact.interface.obstacle import GapFunction as GapFunction
from contact.interface.obstacle import Level as Level
from contact.interface.obstacle import Paraboloid as Paraboloid
from contact.interface.obstacle import Plane as Plane
from contact.interface.obstacle import Punch as Punch
from contact.interface.obstacle import Shape as Shape
from contact.interface.obstacle import Sphere as Sphere
from contact.interface.obstacle import Triangles as Triangles
from contact.mesh.domain import Domain as Domain
from contact.mesh.reader import from_msh as from_msh
from contact.methods.options import FixedPointOptions as FixedPointOptions
from contact.methods.options import NewtonOptions as NewtonOptions
from contact.methods.options import PenaltyOptions as PenaltyOptions
from contact.output.files import write_outputs as write_outputs
from contact.output.solution import Solution as Solution
from contact.problem.contact import Contact as Contact
from contact.problem.problem import ContactProblem as Problem  # noqa: F401
from contact.solving import NotConvergedError as NotConvergedError
from contact.solving import SolveInterrupted as SolveInterrupted
from contact.solving import evolve as evolve
from contact.solving import solve as solve
from forms.hencky import Linear as Linear
from forms.hencky import Log as Log
from forms.hencky import UserLaw as UserLaw
from forms.history import Response as Response
from forms.j2 import J2 as J2
from forms.j2 import Tabulated as Tabulated
from forms.j2 import Voce as Voce
from forms.laws import Coulomb as Coulomb
from forms.laws import PerfectConductivity as PerfectConductivity
from forms.laws import RampConductivity as RampConductivity
from forms.laws import ShiftedConductivity as ShiftedConductivity
from forms.laws import SlipCoefficient as SlipCoefficient
from forms.piezo import Piezo as Piezo

__version__: str
